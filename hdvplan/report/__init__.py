"""Results as tables, pictures, maps and files: values in, objects or bytes out."""
