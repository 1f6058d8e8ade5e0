// One course in time, as a candidate that data are asked about, and what people and files are told of it.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "server/diagnosis/selection/curves/nameless_curve.h"
#include "server/diagnosis/selection/curves/session_slots.h"

namespace touchstone::diagnosis::selection {

enum class CourseKind { kStep, kStretch, kWarmUp, kWave, kConstant, kLine };

// What one course explains, and how probable it is.
struct CandidateCourse {
  CourseKind kind = CourseKind::kStep;
  int begin = 0, end = 0;  // slots [begin, end)
  double constant = 0;     // time constant or period, in units of the covariate
  double phase = 0;        // of a wave at the first touch, rad
  int finger = -1;         // -1: each has a value of its own
  Eigen::VectorXd values;  // of the fingers, mm, relative to each other
  double log_evidence = -INFINITY;
};

// Of the course at one place of the session, for a value of 1.
double ShareAt(const CandidateCourse& course, const SessionSlots& slots, int place);

// Knots, values per finger and words; without evidence and held-out errors.
NamelessCurve CurveOf(const CandidateCourse& course, const SessionSlots& slots,
                      const CurveCovariate& covariate);

// False where neighbouring knots would be one in a file.
bool HasRisingKnots(const NamelessCurve& curve);

}  // namespace touchstone::diagnosis::selection
