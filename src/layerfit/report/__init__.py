"""Results for people: terminal blocks, pictures and a page."""
