"""What a reference is: reading renders, resolving their channels and checking them."""
