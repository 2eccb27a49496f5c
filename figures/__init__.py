"""Draw figures and films of datasets and plain arrays by Matplotlib; robots, tasks and plans are not known here."""
