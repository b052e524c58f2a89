"""Air data as one system: faults found where pressures, lift, attitude, inertia and ground velocity disagree."""
