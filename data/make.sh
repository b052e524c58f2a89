#!/bin/sh
# Make the logs of this folder anew, here or in the folder given: data/make.sh [FOLDER]
set -e
here=$(cd "$(dirname "$0")" && pwd)
cd "${1:-$here}"

# Cessna Citation II at 100 m/s, 3-2-1-1 on the elevator, 0.01 m/s of noise on the airspeed, no fault
bfi simulate citation --noise tas=0.01 --seed 2024 -o citation_clean.h5

# the bias of the thesis's table 5-2 at 13.8 s, 4 m/s
bfi inject citation_clean.h5 --fault bias,name=bias_13.8,channel=tas,magnitude=4,onset_s=13.8 -o citation_bias.h5

# the same and a sinusoid whose phase runs from the start of the log
bfi inject citation_bias.h5 --fault sine,name=sine_1.15,channel=tas,magnitude=2,frequency_hz=1.15,onset_s=6.35,phase_reference=window -o citation_two_faults.h5

# what a recorder without a truth would give: time, elevator and airspeed of the log with the bias
bfi convert citation_bias.h5 -o all_channels.csv
grep -v '^#' all_channels.csv | cut -d, -f1,3,6 > citation_bias.csv
rm all_channels.csv

# what a PX4 autopilot in the same aircraft would have recorded: an airspeed at 10 Hz that reads 3 m/s too little from
# 140 s on its clock
bfi simulate citation --duration 60 --step 3 --amplitude 0.05 --noise tas=0.1 --noise pitch=0.0003 --seed 2025 -o flight.h5
bfi inject flight.h5 --fault bias,channel=tas,magnitude=-3,onset_s=40 -o px4.h5
python3 "$here/make_ulog.py" px4.h5 px4_bias.ulg
rm flight.h5 px4.h5
