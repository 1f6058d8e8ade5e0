// Numbers by which the engine says whether structure remains and whether nothing is missing.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::engine {

struct EngineRules {
  Rule<double> unexplained_p{
      "engine.unexplained_p",
      1e-4,
      "probability",
      "Structure without a name remains only where the lack of fit is less probable by chance.",
      "Not recorded.",
      "Larger: chance makes UNEXPLAINED more often. Smaller: weak structure stays unsaid."};
  Rule<double> unexplained_share{
      "engine.unexplained_share",
      0.01,
      "share",
      "Structure without a name remains only where the error exceeds the noise by more than this share.",
      "Not recorded.",
      "Smaller: long sets are UNEXPLAINED for a rest that nobody would see. Larger: a visible rest stays "
      "unsaid."};
  Rule<double> min_degrees_of_freedom{"engine.min_degrees_of_freedom",
                                      2,
                                      "degrees of freedom",
                                      "A hypothesis with fewer clusters beyond the values that it has to "
                                      "explain them is not tested (p is 1).",
                                      "Not recorded.",
                                      "Not measured."};
  Rule<int> noise_draws{
      "engine.noise_draws",
      199,
      "",
      "Draws from the given model whose worst hypothesis is compared with that of the data.",
      "Argument: the least p that draws give is 1 / 200.",
      "Smaller: p has coarser steps. Larger: every verdict takes longer."};
};
inline constexpr EngineRules kEngineRules;

}  // namespace touchstone::diagnosis::engine
