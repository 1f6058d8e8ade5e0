// What the gateway costs and how punctual it is, measured on an emulated rig and printed. Each returns 0, or
// 1 if it could not be measured.
#pragma once

namespace touchstone {

// The gateway's own time in a touch, of which part waits for the disk.
int MeasureOverhead(int touches, double speedup);
// Its share of a core, idle and busy, at 500 states a second.
int MeasureCpu(double seconds);
// From Control.Stop until the emulated controller has begun the program that stops.
int MeasureStop(int repeats);
// Contact times against the truth, with 100 ppm of drift and 5 ms of jitter.
int MeasureClock(int touches, double speedup, double warm_up_s);

}  // namespace touchstone
