"""A class: submissions in, workers, results out."""
