"""Pictures and reports of decisions, for people: one file each, nothing fetched, the same bytes on every run."""
