"""Study files: tables, axes and cases."""
