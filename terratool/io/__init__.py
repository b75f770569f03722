"""Files of others: what may be opened, and the formats that several packages read or write."""
