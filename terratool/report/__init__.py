"""How results are said: numbers, words, tables, Markdown, HTML and JSON; nothing of terrains."""
