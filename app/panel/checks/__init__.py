"""What can be wrong in a panel file whose shape is right, beside what each widget checks itself."""
