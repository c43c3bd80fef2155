"""Things to make: parts, moulds, drawings, pictures and casting recipes in folders."""
