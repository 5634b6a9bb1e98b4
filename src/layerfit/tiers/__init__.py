"""Other ways to print one material: cheaper ones, with their error told."""
