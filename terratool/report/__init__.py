"""Output of results: numbers, words, tables, Markdown, HTML and JSON, independent of terrains."""
