"""Results as published documents, tables of text, figures and self-contained pages."""
