def markdown(r,e): return []
