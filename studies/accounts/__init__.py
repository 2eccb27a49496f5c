"""Accounts of papers: their claims with one verdict each, and the files that report them."""
