"""Tasks: path, limits and objective as data, laid out for one robot (`scenario`), and the schemes of transcription."""
