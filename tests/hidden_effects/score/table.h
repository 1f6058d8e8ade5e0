// The table of the trial: rates with intervals against targets.
#pragma once

#include <map>
#include <string>
#include <utility>

namespace touchstone::hidden {

struct Rate {
  int yes = 0, of = 0;
  double Value() const { return of == 0 ? 0 : static_cast<double>(yes) / of; }
};

// Clopper-Pearson, 95 %.
std::pair<double, double> Interval(const Rate& rate);

// Rates by (arm, measure), of the diagnosis or of a baseline.
using Rates = std::map<std::pair<std::string, std::string>, Rate>;

struct Results {
  Rates diagnosis, bic, rmse_drop, gp;
};

// Markdown.
std::string Table(const Results& results);

}  // namespace touchstone::hidden
