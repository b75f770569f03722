"""What was found out, for people and for programs: JSON, Markdown, a page, a table."""
