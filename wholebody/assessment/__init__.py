"""The judgement of postures and motions; it shares nothing with the methods."""
