"""Ways through a survey, and what bars them."""
