"""The methods of flying to a goal that are compared."""

OURS = "UAL, go_to_waypoint"
FAR = "one far position setpoint"
PURSUIT = "UAL, tracker: pursuit"
WAYS = (OURS, FAR, PURSUIT)
