// Numbers by which the noise of readings is described (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::touches {

struct NoiseRules {
  Rule<double> enter{
      "touches.noise.enter",
      10,
      "nats",
      "What a further parameter of the noise, or heavy tails, must gain in log likelihood.",
      "Not recorded.",
      "Smaller: chance and misfit are named as kinds of noise. Larger: weak kinds stay unnamed."};
  Rule<double> without_repeats{
      "touches.noise.without_repeats",
      20,
      "nats",
      "What a kind of noise must gain that no repeat can confirm.",
      "Argument: residuals hold the misfit too, repeats do not. The number is not recorded.",
      "Smaller: a misfit is named as noise. Larger: sets without repeats show no kind of noise."};
  Rule<double> declared_gain{
      "touches.noise.declared_gain",
      3,
      "nats",
      "What a kind must gain that the model declares, and fingers by themselves over one loud finger.",
      "Not recorded.",
      "Smaller: declared kinds stay that are not there. Larger: declared kinds that are there go, or many "
      "fingers become one."};
  Rule<double> declared_excluded{
      "touches.noise.declared_excluded",
      5,
      "nats",
      "A declared value whose log likelihood is behind by so much is ruled out.",
      "Not recorded. It is a likelihood ratio of 150.",
      "Smaller: true values of a model are called absent. Larger: values stay that the data contradict."};
  Rule<double> times_beside_lengths{
      "touches.noise.times_beside_lengths",
      1,
      "nats",
      "What a noise of times beside one of lengths must bring over lengths alone.",
      "Argument: lengths alone are simpler. The number is not recorded.",
      "Smaller: small noises of times appear by chance. Larger: the two are not told apart."};
  Rule<double> kurtosis{
      "touches.noise.kurtosis", 4,
      "standard errors",        "Excess kurtosis below this is not searched for tails or outliers.",
      "Not recorded.",          "Smaller: more searches for nothing. Larger: moderate tails are overlooked."};
  Rule<double> repeats_kurtosis{
      "touches.noise.repeats_kurtosis",
      2,
      "standard errors",
      "The same of repeats, where there are enough.",
      "Argument: repeats confirm what residuals show. The number is not recorded.",
      "Smaller: tails that a misfit makes are searched. Larger: moderate tails are overlooked."};
  Rule<size_t> min_repeats{
      "touches.noise.min_repeats",
      60,
      "",
      "So many touches that are repeats are asked whether a kind of noise, or uneven scatter, shows in them.",
      "Not recorded.",
      "Smaller: a few repeats decide. Larger: misfit passes as noise in sets with few repeats."};
  Rule<double> repeats_share{
      "touches.noise.repeats_share",
      0.25,
      "share",
      "Repeats must show this share of the gain that residuals show.",
      "Argument: no misfit touches repeats. The number is not recorded.",
      "Smaller: a misfit passes as noise. Larger: kinds go that few repeats show weakly."};
  Rule<double> repeats_gain{
      "touches.noise.repeats_gain",
      3,
      "nats",
      "... and at least so much.",
      "Not recorded.",
      "Smaller: chance among repeats confirms. Larger: kinds go that few repeats show weakly."};
  Rule<double> min_slope{
      "touches.noise.min_slope",
      0.02,
      "",
      "The smallest growth of the noise with the tangent of the incidence that is tried.",
      "Not recorded.",
      "Larger: weak growth is overestimated. Smaller: steps of the search go to what does not show."};
  Rule<double> max_slope{"touches.noise.max_slope",
                         10,
                         "",
                         "The largest growth of the noise with the tangent of the incidence that is tried.",
                         "Not recorded.",
                         "Smaller: strong growth ends at the bound. Larger: coarser steps of the search."};
  Rule<double> max_scale{"touches.noise.max_scale",
                         8,
                         "",
                         "How many times as loud as the others one finger's noise is tried, or as quiet.",
                         "Not recorded.",
                         "Smaller: a louder finger ends at the bound. Larger: coarser steps of the search."};
  Rule<size_t> max_part{"touches.noise.max_part",
                        1500,
                        "",
                        "The shape of heavy tails is found on at most so many touches of a set, evenly.",
                        "Cost: the likelihood of tails is an integral for each touch.",
                        "Smaller: tails are less well known. Larger: a slower diagnosis of large sets."};
  Rule<int> sigma_steps{
      "touches.noise.sigma_steps",
      13,
      "",
      "So many golden section steps find the sigma of noise that is not Gaussian.",
      "Cost: each is a likelihood of all touches. 13 narrow two logarithmic units down to 0.004. 18 before.",
      "Smaller: sigma is off by per cents. Larger: a slower search for nothing."};
  Rule<double> beside_farthest{
      "touches.noise.beside_farthest",
      0.6,
      "share",
      "Outliers off by more than this share of the farthest leave first; the rest is judged again.",
      "Argument: a fit that has followed one outlier makes the repeats of its pose look like others.",
      "Smaller: good touches leave with the outlier. Larger: outliers leave one by one, and passes run out."};
  Rule<double> share_step{
      "touches.noise.share_step",
      0.02,
      "",
      "The step in the share of a noise of lengths over which its likelihood's curvature is taken.",
      "Not recorded.",
      "Smaller: rounding enters the standard error. Larger: the likelihood is no parabola over it."};
  Rule<double> min_slowness_spread{
      "touches.noise.min_slowness_spread",
      1.2,
      "",
      "Slowest over fastest touch from which a noise of lengths can be told from one of times.",
      "Not recorded.",
      "Smaller: the two are told apart by chance. Larger: sets with two near speeds are not asked."};
  Rule<double> max_tangent{
      "touches.noise.max_tangent",
      10,
      "",
      "Noise that grows with the tangent of the incidence grows no further than for this tangent.",
      "Not recorded. It is an incidence of 84 degrees.",
      "Smaller: growth on steep faces is lost. Larger: a few grazing contacts decide the growth."};
  Rule<size_t> max_delays{"touches.noise.max_delays",
                          6000,
                          "",
                          "Ticks of all fingers are looked for in at most so many delays, the first ones.",
                          "Cost: bounds time. The number is not recorded.",
                          "Smaller: coarser intervals. Larger: a slower diagnosis of large sets."};
  Rule<size_t> min_delays{"touches.noise.min_delays",
                          20,
                          "",
                          "With fewer delays no polling interval is looked for.",
                          "Not recorded.",
                          "Smaller: few delays lie on a tick by chance. Larger: small sets show no polling."};
  Rule<double> hidden_share{
      "touches.noise.hidden_share",
      0.25,
      "share",
      "Where ticks make more of the variance than this, other kinds of noise are not assessed.",
      "Argument: ticks that make most of the scatter say nothing of its kinds. The number is not recorded.",
      "Smaller: kinds are left unassessed that would show. Larger: declared kinds are called absent behind "
      "ticks."};
  Rule<double> min_missed{"touches.noise.min_missed",
                          0.002,
                          "share",
                          "A smaller share of missed contacts is no property of the rig.",
                          "Not recorded.",
                          "Smaller: single slips become a probability. Larger: rare dropouts stay unnamed."};
  Rule<double> tick_tolerance{
      "touches.noise.tick_tolerance",
      1.01e-6,
      "s",
      "A time this near to a multiple of an interval lies on it.",
      "Argument: files keep whole microseconds, so that a difference of two is off by up to one.",
      "Smaller: rounded times miss their tick. Larger: more times lie on a tick by chance."};
  Rule<double> min_tick{"touches.noise.min_tick",
                        20e-6,
                        "s",
                        "No finer tick is looked for.",
                        "Argument: a tick near the rounding of the file holds any time.",
                        "Smaller: times lie on fine ticks by chance. Larger: fast polling stays unnamed."};
  Rule<size_t> min_equal{
      "touches.noise.min_equal",
      4,
      "",
      "So many delays at one place may be a tick's, in a set of which a part is read in ticks.",
      "Not recorded.",
      "Smaller: chance makes ticks. Larger: ticks of few touches are overlooked."};
  Rule<double> over_density{
      "touches.noise.over_density",
      10,
      "",
      "... and so many times what the density of the delays gives.",
      "Not recorded.",
      "Smaller: chance makes ticks in large sets. Larger: ticks of a small part are overlooked."};
  Rule<int> min_on_tick{"touches.noise.min_on_tick",
                        8,
                        "",
                        "So many touches, or times of one finger, must lie on a tick for it to be named.",
                        "Not recorded.",
                        "Smaller: chance makes ticks. Larger: ticks of few touches are overlooked."};
  Rule<double> max_share_of_others{
      "touches.noise.max_share_of_others",
      0.5,
      "share",
      "A tick is one finger's only if less of every other finger's times lies on it.",
      "Not recorded.",
      "Smaller: a fine tick of one finger goes unnamed. Larger: a tick of all fingers is one finger's."};
};

inline constexpr NoiseRules kNoiseRules;

}  // namespace touchstone::diagnosis::touches
