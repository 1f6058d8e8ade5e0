// Numbers by which explanations of touches are searched and chosen (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct SelectionRules {
  Rule<double> max_missed{
      "selection.max_missed",
      0.5,
      "share",
      "A mesh that more of an object's touches miss is refused.",
      "Not recorded.",
      "Smaller: sets with badly placed objects are refused. Larger: a wrong mesh is searched for effects."};
  Rule<double> warn_missed{
      "selection.warn_missed",
      0.05,
      "share",
      "A mesh that more of an object's touches miss is warned of.",
      "Not recorded.",
      "Smaller: warnings of a few touches at edges. Larger: a wrong mesh or pose goes unsaid."};
  Rule<double> outside{"selection.outside",
                       1e-6,
                       "m",
                       "Targets farther outside of the mesh's box are said to lie outside.",
                       "Argument: less is rounding. A rounding error of 2e-9 mm was said to lie outside.",
                       "Smaller: rounding is reported. Larger: only the words of a warning change."};
  Rule<double> max_travel{
      "selection.max_travel",
      2.5,
      "",
      "A finger that in the model travels farther than so many standoffs has missed its target.",
      "Argument: it has met nothing at the target. The number is not recorded.",
      "Smaller: touches of curved objects count as missed. Larger: a finger that meets another part counts "
      "as met."};
  Rule<double> unit_factor{
      "selection.unit_factor",
      100,
      "",
      "Measured over predicted spread of the times, or the inverse, from which a unit is wrong.",
      "Argument: no effect gives such a factor, and units differ by 1000.",
      "Smaller: sets are refused that effects explain. Larger: wrong units reach the search."};
  Rule<double> edge{
      "selection.edge",
      0.3e-3,
      "m",
      "So far each way a contact is moved to see whether an edge is near; touches at an edge are left out.",
      "Not recorded. The reason that a report gives for such touches says 0.3 mm.",
      "Smaller: touches stay that another finger meets elsewhere. Larger: small objects lose their touches."};
  Rule<double> edge_jump{
      "selection.edge_jump",
      0.5e-3,
      "m",
      "A second difference of the travel from which a step between the moved contacts is an edge.",
      "Not recorded.",
      "Smaller: curved faces are edges. Larger: low steps are none, and their touches are outliers."};
  Rule<double> wild{
      "selection.wild",
      100,
      "",
      "Robust standard deviations from the given model beyond which a touch leaves before the search.",
      "Argument: beside such readings nothing else shows. One in 576 made the verdict UNEXPLAINED.",
      "Smaller: strong effects lose their touches. Larger: a wild reading hides the other effects."};
  Rule<double> few_wild{
      "selection.few_wild",
      0.005,
      "share",
      "Wild touches up to this share, or one, leave; of more none does.",
      "Argument: many are no slips of single readings. The number is not recorded.",
      "Smaller: slips stay in a set that has several. Larger: touches leave that an effect moves."};
  Rule<int> max_searched{"selection.max_searched",
                         2400,
                         "",
                         "The search works on at most so many touches; larger sets are thinned.",
                         "Cost: the likelihood costs the square of an object's touches.",
                         "Test: Workspace.ThinsALargeSetToWholePosesOfEveryObject. Larger: a slower search."};
  Rule<int> min_repeats{
      "selection.min_repeats",
      4,
      "",
      "Of a pose that is searched so many repeats take part, if it has them, before other poses are left "
      "out.",
      "Argument: the scatter of repeats tells noise from misfit. The number is not recorded.",
      "Smaller: noise is less well known in large sets. Larger: fewer poses are searched."};
  Rule<double> rounding{
      "selection.rounding",
      0.3e-6,
      "m",
      "What mesh files and numbers of measurement files are rounded to, about: no floor is lower.",
      "Not recorded.",
      "Smaller: the pattern of rounding is explained. Larger: less noisy sets have no noise."};
  Rule<double> min_repeat_dof{
      "selection.min_repeat_dof",
      8,
      "degrees of freedom",
      "With fewer degrees of freedom of repeats, these do not say how large the noise is.",
      "Not recorded.",
      "Smaller: a few repeats decide on the lack of fit. Larger: the floor is what residuals leave, an upper "
      "bound."};
  Rule<size_t> max_objects_varied{
      "selection.max_objects_varied",
      12,
      "",
      "Of more objects, effects that seldom differ between them are not tried with a value each.",
      "Cost: as many values as objects. The number is not recorded.",
      "Smaller: such effects are found on one object at most. Larger: a slower search of sets with many "
      "objects."};
  Rule<int> terms_fitted{"selection.terms_fitted",
                         3,
                         "",
                         "So many terms of the dictionary, the best by their scores, are fitted.",
                         "Cost: each is a fit. The number is not recorded.",
                         "Smaller: a term that scores second is not tried. Larger: a slower search."};
  Rule<int> max_formula_terms{
      "selection.max_formula_terms",
      2,
      "",
      "A formula has at most so many terms.",
      "Not recorded.",
      "Smaller: rests of two causes have half a formula. Larger: formulas that nobody reads."};
  Rule<int> passes{
      "selection.passes",
      3,
      "",
      "So often touches are set aside or weighed anew and the search is repeated.",
      "Cost: each is a search. Edges are looked for again under the better model since there are 3.",
      "Smaller: outliers and edges of the better model stay. Larger: a slower diagnosis."};
  Rule<double> as_good{
      "selection.as_good",
      0.5,
      "nats",
      "A fit that was searched anew is preferred unless it is behind an extended one by more.",
      "Not recorded.",
      "Smaller: remnants of an earlier search stay. Larger: a better explanation is given up."};
  Rule<double> improbable{
      "selection.improbable",
      0.05,
      "probability",
      "Where a formula or a curve stands, a step with its equivalents less probable than this is taken out.",
      "Not recorded.",
      "Smaller: improbable steps stay. Larger: the curve takes over what an effect explains."};
  Rule<int> simulated_draws{
      "selection.simulated_draws",
      99,
      "",
      "So many sets are drawn from a model whose noise has a shape, to see what chance gives.",
      "Cost: each is a simulation. The smallest p is 1 in 100.",
      "Smaller: coarser p-values. Larger: a slower diagnosis."};
  Rule<int> curve_degree{"selection.curve_degree",
                         3,
                         "",
                         "Degree of the polynomials of a covariate that are tried as what may be missing.",
                         "Not recorded.",
                         "Smaller: bent curves are not seen. Larger: more columns, of which each is weaker."};
  Rule<double> difference_p{
      "selection.difference_p",
      1e-5,
      "probability",
      "What repeats of rounds differ by is said if chance gives it less often, over all that is tried.",
      "Not recorded.",
      "Smaller: effects of one round act on all. Larger: chance makes parts."};
  Rule<double> stretch_p{"selection.stretch_p",
                         1e-8,
                         "probability",
                         "The same of a stretch of the session.",
                         "Sets: scatter that moves all fingers together gave 2e-6.",
                         "Smaller: changes half-way go unsaid. Larger: scatter of all fingers makes parts."};
  Rule<double> rest_is_more_p{
      "selection.rest_is_more_p",
      1e-4,
      "probability",
      "An effect is not the whole of a part if the scatter left there is so improbable beside the others'.",
      "Not recorded.",
      "Smaller: two effects in a part pass as one. Larger: chance makes a second effect."};
  Rule<double> ahead{
      "selection.ahead",
      6,
      "nats",
      "What an effect in a part must be ahead of all else that explains what repeats differ by.",
      "Not recorded.",
      "Smaller: effects of all touches are named as a part's. Larger: effects of one round act on all."};
  Rule<double> same{"selection.same",
                    3,
                    "nats",
                    "Effects and parts as near as this to the best are named beside it.",
                    "Not recorded.",
                    "Smaller: one is named where data cannot tell. Larger: many are named where data can."};
  Rule<double> min_difference_dof{"selection.min_difference_dof",
                                  40,
                                  "degrees of freedom",
                                  "With fewer degrees of freedom of repeats no part is compared.",
                                  "Not recorded.",
                                  "Smaller: tests on few repeats. Larger: small sets show no part."};
  Rule<int> orders{
      "selection.orders",
      199,
      "",
      "So many orders of touches within their poses say what chance explains, of parts and of rounds.",
      "Cost: each is a projection. They give a mean and a variance.",
      "Smaller: p-values scatter. Larger: a slower diagnosis."};
  Rule<int> part_steps{"selection.part_steps",
                       4,
                       "",
                       "So many steps of Gauss and Newton fit the effect of a part.",
                       "Cost: each is a simulation. The number is not recorded.",
                       "Smaller: values of strong effects are off. Larger: time for nothing."};
  Rule<double> visible{
      "selection.visible",
      1e-6,
      "share",
      "An effect is tried in a part if more of its column's square differs within poses.",
      "Argument: less is rounding.",
      "Smaller: effects are fitted to rounding. Larger: effects are not tried that show in a few touches."};
  Rule<double> clear_errors{
      "selection.clear_errors",
      3,
      "standard errors",
      "A value of the effect in a part is told if it is larger than so many of its errors.",
      "Not recorded.",
      "Smaller: values that chance gives are told. Larger: clear values are left out of the words."};
  Rule<double> max_left{
      "selection.max_left",
      0.98,
      "share",
      "An effect that leaves more of the squares describes no difference, and only the part is told.",
      "Not recorded.",
      "Smaller: weak effects are not named. Larger: effects are named that explain nothing."};
  Rule<double> max_excess_left{
      "selection.max_excess_left",
      0.5,
      "share",
      "An effect that leaves more of what a part scatters by beyond the others does not describe the part.",
      "Sets: rows in reversed order were a speed error of 0.50 that left seven tenths of their scatter.",
      "Smaller: effects that explain most of a part go unnamed. Larger: effects are named that explain "
      "little."};
  Rule<size_t> max_parts_named{"selection.max_parts_named",
                               2,
                               "",
                               "So many parts are named that say the same.",
                               "Display: a sentence. The number is not recorded.",
                               "Smaller: one of two rounds is blamed. Larger: a sentence that nobody reads."};
  Rule<size_t> max_also{"selection.max_also",
                        3,
                        "",
                        "So many other effects are named that say the same of a part.",
                        "Display: a sentence. The number is not recorded.",
                        "Smaller: a rival is not told. Larger: a sentence that nobody reads."};
  Rule<int> max_curves_tried{
      "selection.max_curves_tried",
      3,
      "",
      "Curves over so many covariates, the best first, compete with the named effects.",
      "Cost: fits without each effect, for each curve. The number is not recorded.",
      "Smaller: a curve that needs fewer effects is not tried. Larger: a slower search."};
  Rule<double> beside_curve{
      "selection.beside_curve",
      3,
      "nats",
      "An effect must be worth more than this beside a curve.",
      "Not recorded.",
      "Smaller: effects stay that the curve explains. Larger: weak effects go into the curve."};
  Rule<double> formula_behind{
      "selection.formula_behind",
      5,
      "nats",
      "A formula that is behind a curve by less is preferred.",
      "Argument: it says the same in fewer words. The number is not recorded.",
      "Smaller: curves where a formula would do. Larger: formulas that miss the shape."};
  Rule<double> memory_ahead{
      "selection.memory_ahead",
      10,
      "nats",
      "Correlated noise is named if it is so far ahead of a curve, a step and a period.",
      "Argument: a course of another session would not be this one. The number is not recorded.",
      "Smaller: courses in time pass as noise. Larger: correlated noise is UNEXPLAINED."};
  Rule<double> memory_rougher{
      "selection.memory_rougher",
      3,
      "nats",
      "... and so far ahead of a course without corners.",
      "Not recorded.",
      "Smaller: periods and warm-ups pass as noise. Larger: correlated noise is UNEXPLAINED."};
  Rule<double> overtaken{
      "selection.overtaken",
      3,
      "nats",
      "A curve of time alone that is ahead of a named effect by so much takes its place.",
      "Argument: where it is 20 times as probable. It was 1, three times as probable, before.",
      "Smaller: named effects give way to curves. Larger: warm-ups pass as named effects."};
  Rule<double> beyond_correlated{
      "selection.beyond_correlated",
      60,
      "nats",
      "An effect of each finger worth more than this is no mean or trend of correlated noise or of a course.",
      "Not recorded.",
      "Smaller: means of correlated noise pass as lengths. Larger: true lengths and drifts give way to "
      "curves."};
  Rule<double> worth_under_memory{
      "selection.worth_under_memory",
      10,
      "nats",
      "An effect must be worth more than this under correlated noise.",
      "Not recorded.",
      "Smaller: effects stay that correlated noise explains. Larger: weak effects go into the noise."};
  Rule<double> dropped{
      "selection.dropped",
      15,
      "nats",
      "A formula must be better than a curve by so much for each named effect that it needs besides.",
      "Not recorded.",
      "Smaller: formulas with superfluous effects. Larger: curves where a formula would do."};
};

inline constexpr SelectionRules kSelectionRules;

}  // namespace touchstone::diagnosis::selection
