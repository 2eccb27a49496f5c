"""The steps of planning: from first guesses to an audited motion."""
