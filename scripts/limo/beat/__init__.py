"""Hearts that beat: surfaces V_v(P_v, P_a) and V_a(P_v, P_a) of a device in a closed loop with a pneumatic driver."""
