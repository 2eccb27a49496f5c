"""Reports of a plan: data over time, text, HTML page, figures and film."""
