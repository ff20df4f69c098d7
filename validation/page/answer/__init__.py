"""The page of an answer: what becomes of the ride, the line from the side, forces, and how sure all that is."""
