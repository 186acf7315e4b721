"""The gallery of tasks and robots: its pages, their record, and their pictures."""
