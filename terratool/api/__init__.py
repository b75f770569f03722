"""What Python users see: a terrain's verbs, definitions built in Python, and their options."""
