"""Where methods fail: a named catalogue of hard cases, what each method answers, and what that answer is worth."""
