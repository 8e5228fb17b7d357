"""The nouns and the promises: what every other room of the library means by its words."""
