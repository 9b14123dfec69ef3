"""What a study says: its tables, axes and cases."""
