"""`python -m tests.audits regress`: counts that do not depend on the machine, compared with those that were locked."""
