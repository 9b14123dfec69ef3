"""Texts of study files of the kinds whose cases are no single simulations."""

BRANCHES = """
rig = "mokhtar2017"
[grid]
clearance = { start = "112 um", stop = "124 um" }
speed_ratio = [0.74, 0.75]
friction = 0.3
[contact]
model = "mokhtar2017"
[branch]
along = "clearance"
periods = [1, 2]
step = "4 um"
sweeps = 1
points = 60
[record]
transient = 40
samples_per_revolution = 64
"""
RUN_UPS = """
rig = "mokhtar2017"
[run_up]
start = "1800 rpm"
stop = "1500 rpm"
[grid]
"run_up.time" = ["0.3 s", "0.5 s"]
clearance = ["100 um", "5 mm"]
friction = 0.2
[contact]
model = "mokhtar2017"
[record]
samples_per_revolution = 32
[[record.probe]]
name = "left"
node = 1
angle = "-45 deg"
[run]
block = 1
"""
