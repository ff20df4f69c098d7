"""The page of an answer: course of the ride, side view, forces, reliability."""
