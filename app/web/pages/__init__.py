"""What a page is rendered from: templates, words, choices of display, and their context."""
