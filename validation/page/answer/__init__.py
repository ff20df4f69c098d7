"""The page of an answer: course of the ride, side view, forces, reliability."""

EVENTS = ("release", "thrust_end", "brake", "turn", "stop", "arrival", "back", "lift_off")
