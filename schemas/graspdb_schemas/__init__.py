"""The ground floor: table schemas, session manifest, the words of hands, errors."""
