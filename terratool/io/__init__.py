"""File input and output: guards for untrusted files, and formats that several packages use."""
