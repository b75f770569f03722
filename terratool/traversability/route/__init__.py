"""Routes through a survey, and the barriers on them."""
