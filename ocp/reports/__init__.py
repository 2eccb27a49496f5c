"""What a plan tells: its figures as data, as text, as a page, as pictures and films."""
