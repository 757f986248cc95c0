"""How wide texts are in the fonts that the panel brings, and which of a panel's are cut."""
