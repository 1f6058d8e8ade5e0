// Numbers by which mistakes of measurement files are tried and claimed (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::checks {

struct CheckRules {
  // Of the trials.
  Rule<int> sampled_touches{
      "checks.sampled_touches",
      160,
      "",
      "About so many touches, spread over objects, poses and time, are what mistakes are tried on.",
      "Sets: with 160 the right mistake came first in 5 of 5, at a fiftieth of the error; the next at 0.38.",
      "Smaller: not measured. Larger: every trial costs more."};
  Rule<int> min_sampled_of_object{"checks.min_sampled_of_object",
                                  8,
                                  "",
                                  "Of each object at least so many touches are sampled, where it has them.",
                                  "Not recorded.",
                                  "Larger: sets of many objects take longer to try."};
  Rule<int> min_touches{"checks.min_touches",
                        12,
                        "",
                        "A sample of fewer touches is not looked at: no mistake is claimed.",
                        "Not recorded.",
                        "Test: DataProblems.TooFewTouchesBlameNoFile (six touches)."};
  Rule<double> counted_share{
      "checks.counted_share",
      0.7,
      "share",
      "Of the touches of each object, or of the pictures, those that fit best count in the error of a trial.",
      "Argument: missing physics spoils a few; these neither hide a mistake nor make one.",
      "Smaller: a mistake in most of them is missed. Larger: a few corrupted ones decide."};
  Rule<double> min_speed_m_s{"checks.min_speed_m_s",
                             1e-6,
                             "m/s",
                             "A slower median speed counts as this one where lengths become times.",
                             "Argument: far below any arm; it keeps the quotient finite.",
                             "Larger: slow files have too small a threshold in time."};

  // Where a mistake is looked for.
  Rule<double> min_misfit_m{
      "checks.min_misfit_m",
      0.5e-3,
      "m",
      "A misfit of less is no mistake but for factors of times and speeds; a touch beyond it is off.",
      "Not recorded.",
      "Smaller: physics that is missing is called a mistake. Larger: small ones are missed."};
  Rule<int> min_wrong{
      "checks.min_wrong",
      4,
      "",
      "So many touches off by min_misfit_m have mistakes looked for, whatever min_misfit says.",
      "Not recorded.",
      "Smaller: files that fit are tried. Larger: small parts are missed."};
  Rule<double> min_misfit{"checks.min_misfit",
                          0.15,
                          "share",
                          "From this error over the spread of the times on mistakes are looked for.",
                          "Argument: the mildest factor of times or speeds leaves more.",
                          "Smaller: files that fit are tried for nothing. Larger: mild factors are missed."};
  Rule<double> sorted_misfit{
      "checks.sorted_misfit",
      0.15,
      "share",
      "From this error over the spread, of all touches, on a sorted column is looked for.",
      "Not recorded.",
      "Not measured."};
  Rule<int> max_parts{"checks.max_parts",
                      4,
                      "",
                      "So many parts with mistakes of their own are told, one after the other, at most.",
                      "Argument: names exchanged in one round are two.",
                      "Larger: each costs all trials again."};

  // What may be claimed.
  Rule<double> max_ratio{
      "checks.max_ratio",
      0.2,
      "share",
      "A fix that leaves more than this of the error is not claimed.",
      "Sets: 24 rigs of strong physics, six seeds each, and the public sets made no claim; public sets with "
      "permuted fingers and swapped objects are at 0.017 and 0.10.",
      "Larger: missing physics is called a mistake. Smaller: mistakes beside physics are missed."};
  Rule<double> max_left{
      "checks.max_left",
      0.25,
      "share",
      "A fix that leaves more than this of the spread of the times is not claimed.",
      "Argument: the fix must explain the data, not shrink them as times do that are divided by 1000.",
      "Larger: data that shrank are explained. Smaller: mistakes beside physics are missed."};
  Rule<double> max_before{"checks.max_before",
                          2,
                          "",
                          "A larger error over the spread counts as this one when ratios are taken.",
                          "Argument: what nonsense leaves: uncorrelated sqrt(2), reversed 2.",
                          "Larger: an expectation that is far too large makes any fix look good."};
  Rule<double> clear{"checks.clear",
                     1.5,
                     "",
                     "The next kind of mistake must leave this many times as much, unless the fix is sure.",
                     "Not recorded.",
                     "Smaller: a kind is claimed that another does as well. Larger: none is."};
  Rule<double> sure{
      "checks.sure",   0.05,
      "share",         "A fix that leaves at most this of the error is claimed however well others do.",
      "Not recorded.", "Larger: kinds that cannot be told apart are claimed."};
  Rule<double> tie{"checks.tie",
                   1.1,
                   "",
                   "Fixes whose errors differ by at most this factor fit alike.",
                   "Not recorded.",
                   "Larger: too many are named. Smaller: noise chooses between equals."};
  Rule<size_t> max_named{"checks.max_named",
                         3,
                         "",
                         "Of mistakes that fit alike, of the file or of a part, so many are named.",
                         "Display: a reader compares few alternatives.",
                         "Not measured."};
  Rule<double> scale_tolerance{
      "checks.scale_tolerance",
      0.02,
      "share",
      "A factor of times or speeds may be off by this, and three standard errors, to be the discrete one.",
      "Argument: missing physics biases the factor by about a hundredth; a slowdown of 0.45 is physics.",
      "Smaller: mistakes beside physics are missed. Larger: physics is called a mistake."};
  Rule<double> far_scale_tolerance{"checks.far_scale_tolerance",
                                   0.2,
                                   "share",
                                   "The same for factors of more than 9.",
                                   "Argument: no physics comes near a factor of ten.",
                                   "Not measured."};

  // Mistakes of the whole file.
  Rule<int> max_permuted{"checks.max_permuted",
                         4,
                         "",
                         "Up to so many fingers all orders are tried; of more exchanges, turns, the reverse.",
                         "Cost: the 120 orders of five fingers cost as much as all else.",
                         "Larger: slower."};
  Rule<double> slowest_m_s{"checks.slowest_m_s",
                           0.5e-3,
                           "m/s",
                           "Below it a wrong unit of speeds is tried, and told, before one of times.",
                           "Argument: what touching arms do.",
                           "Changes only which of two equals is first."};
  Rule<double> fastest_m_s{"checks.fastest_m_s",
                           0.5,
                           "m/s",
                           "The same above it.",
                           "Argument: what touching arms do.",
                           "Changes only which of two equals is first."};
  Rule<int> max_shift{"checks.max_shift",
                      2,
                      "",
                      "Rows that times are tried to belong to, each way, besides their own.",
                      "Not recorded.",
                      "Larger: more trials."};

  // A part of the file.
  Rule<double> fine_m{"checks.fine_m",
                      0.25e-3,
                      "m",
                      "Errors of touches below it are alike: noise and the physics that is missing.",
                      "Not recorded.",
                      "Smaller: noise divides the file. Larger: small mistakes are missed."};
  Rule<double> change_nats{"checks.change_nats",
                           1.5,
                           "nats",
                           "What each change between right and wrong costs from one touch to the next.",
                           "Not recorded.",
                           "Smaller: single touches become parts. Larger: short parts vanish."};
  Rule<int> min_part{"checks.min_part",
                     8,
                     "",
                     "The part and the rest each hold so many tried touches, or no part is claimed.",
                     "Not recorded.",
                     "Smaller: few touches are blamed. Larger: short parts are missed."};
  Rule<int> min_run{"checks.min_run",
                    4,
                    "",
                    "So many touches of a part follow each other in the mean, or it is none.",
                    "Not recorded.",
                    "Smaller: scattered touches are called a part."};
  Rule<double> max_rest_error{"checks.max_rest_error",
                              0.35,
                              "share",
                              "The rest of the file keeps at most this error over its spread as it stands.",
                              "Argument: what physics may leave; what is wrong everywhere is no part.",
                              "Larger: a part is claimed of a file that is wrong as a whole."};
  Rule<double> rest_worse{
      "checks.rest_worse",
      1.5,
      "",
      "The fix must make the error of the same object's other touches so many times larger.",
      "Argument: where they are right as they stand, the fix must harm them.",
      "Not measured."};
  Rule<double> same_gain{"checks.same_gain",
                         0.98,
                         "share",
                         "Divisions that gain at least this of the best one's are named beside it.",
                         "Not recorded.",
                         "Smaller: unlikely ones are named."};
  Rule<int> min_block{"checks.min_block",
                      10,
                      "",
                      "So many rows of one object, one after the other, were touched in one go.",
                      "Not recorded.",
                      "Smaller: short runs are wrong or right as a whole."};
  Rule<double> nearly_all{"checks.nearly_all",
                          0.9,
                          "share",
                          "Of such a block: from there on all rows are wrong, up to the rest none is.",
                          "Not recorded.",
                          "Smaller: blocks are rounded that hold two kinds of rows."};
  Rule<size_t> max_ranges{"checks.max_ranges",
                          60,
                          "",
                          "A part of more ranges of touches gets no command that fixes it.",
                          "Display: what a command can list.",
                          "Larger: longer commands."};
  Rule<size_t> ranges_in_words{"checks.ranges_in_words",
                               4,
                               "",
                               "Ranges of touches that a sentence names.",
                               "Display: what a sentence can hold.",
                               "Larger: longer sentences."};

  // Meshes, columns, pairs.
  Rule<double> min_spread{"checks.min_spread",
                          0.3,
                          "",
                          "The extent of the targets over the mesh's below which its unit may be wrong.",
                          "Argument: targets lie on the object and leave its edges out.",
                          "Not measured."};
  Rule<double> max_spread{
      "checks.max_spread", 1.5, "", "The same above which it may be.", "Argument: targets lie on the object.",
      "Not measured."};
  Rule<int> min_distinct_steps{"checks.min_distinct_steps",
                               10,
                               "",
                               "A column whose steps all go one way is sorted from so many steps on.",
                               "Argument: by chance once in a thousand times at the most.",
                               "Smaller: short columns are called sorted."};
  Rule<double> min_up_and_down{
      "checks.min_up_and_down",
      0.15,
      "share",
      "So many of the rows must go against the column's direction in the model for a column to be sorted.",
      "Not recorded.",
      "Smaller: a column that rises by itself is called sorted."};
  Rule<double> min_before_pair{"checks.min_before_pair",
                               0.5,
                               "share",
                               "From this error over the spread on two mistakes at once are tried.",
                               "Cost: pairs take many more trials.",
                               "Smaller: slower. Larger: pairs are missed."};
  Rule<double> pair_stricter{"checks.pair_stricter",
                             0.5,
                             "",
                             "Of two mistakes max_ratio and max_left are so many times as large.",
                             "Argument: two fixes explain more by chance than one.",
                             "Not measured."};

  // Objects.
  Rule<int> min_touches_of_object{"checks.min_touches_of_object",
                                  6,
                                  "",
                                  "An object of fewer tried touches says nothing of its own.",
                                  "Not recorded.",
                                  "Smaller: names are changed for a few touches."};
  Rule<double> min_offset_m{
      "checks.min_offset_m",
      0.010,
      "m",
      "An object that stands off by less is not told as a mistake of its origin.",
      "Argument: ten times what object_pose calls typical (1 mm), twenty times gravity_sag's; below, an "
      "object that stands too low is physics, with an effect that says so.",
      "Smaller: physics is called a mistake. Larger: small fixtures that were forgotten are."};
  Rule<double> offset_step_m{"checks.offset_step_m",
                             0.005,
                             "m",
                             "Heights are tried in steps of this first, where the object is low enough.",
                             "Not recorded.",
                             "Smaller: slower. Larger: the best height may be missed."};
  Rule<int> max_offset_steps{"checks.max_offset_steps",
                             30,
                             "",
                             "Of a high object so many steps are tried each way, of a larger size.",
                             "Cost: each step is a trial.",
                             "Larger: slower."};
  Rule<double> finest_offset_m{
      "checks.finest_offset_m",
      0.1e-3,
      "m",
      "The search for a height ends at this step; heights are told in multiples of it.",
      "Not recorded.",
      "Smaller: digits that physics makes."};
  Rule<double> same_offset_m{"checks.same_offset_m",
                             0.002,
                             "m",
                             "Objects whose heights differ by less from their mean moved by the same.",
                             "Not recorded.",
                             "Larger: different heights are told as one."};
  Rule<double> near_whole_m{
      "checks.near_whole_m",
      0.3e-3,
      "m",
      "A height so near to whole millimetres is told as those.",
      "Argument: missing physics biases an offset by 0.1 to 0.2 mm; people mount at round lengths.",
      "Smaller: digits that physics makes. Larger: halves are rounded away."};
};
inline constexpr CheckRules kCheckRules;

}  // namespace touchstone::diagnosis::checks
