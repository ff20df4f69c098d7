def design(r):
    return []
