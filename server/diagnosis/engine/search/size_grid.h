// Sizes of an effect's value, from far below what rigs show up to the farthest that is simulated: for effects of whose response
// the slope where they change nothing says nothing.
#pragma once

#include <vector>

#include "server/diagnosis/engine/fit/parameterization.h"

namespace touchstone::diagnosis::engine {

// The farthest that a parameter goes from where it changes nothing, and the way there: its bound, or twenty times what rigs
// show: farther off, touches meet other faces, or nothing. A value that acts by its inverse moves no contact, and has its bound alone.
double Reach(const FreeParameter& parameter, double* sign);

// Distances from where the parameter changes nothing, rising by a constant factor; the last is Reach.
std::vector<double> SizesOnGrid(const FreeParameter& parameter);

}  // namespace touchstone::diagnosis::engine
