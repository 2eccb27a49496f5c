"""What is asked: a task, its path and limits, laid out for one robot (`scenario`), and how motions run in between."""
