"""Plans for bathymeter surveys: a backbone of lines, what sounding a leg is worth, and the search for better routes."""
