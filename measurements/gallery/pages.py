def stale_pages(record, folder): return {}
def write_pages(record, folder): return 0
