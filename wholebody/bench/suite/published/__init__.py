"""The problem sets as files that any program reads, and the judge that scores answers to them, whatever wrote them."""
