"""Where methods fail: a named catalogue of hard cases, what each method answers, and the verdict on it."""
