"""What pages are made of: charts, the style, and templates in which every text from data is escaped."""
