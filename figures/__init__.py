"""Draw figures and films of datasets and plain arrays with Matplotlib, without use of robots, tasks or plans."""
