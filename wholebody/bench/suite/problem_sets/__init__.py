"""Problems with known answers, made from seeds: what methods are compared on."""
