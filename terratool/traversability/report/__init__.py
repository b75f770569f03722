"""Reports on vehicles, for people and programs: JSON, Markdown, a page, pictures, tables."""
