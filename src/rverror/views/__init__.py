"""What people see of results: text, JSON, pages, tables and plots."""
