// Of which kind is what a model of photographs leaves, although no effect of the catalogue explains it: something in the
// picture, on the objects, at contours, of each picture by itself, in a few pictures alone.
//
// Each kind is a few columns over the pixels; its share is what they take from pixels that they were not fitted to, of
// all that is left beyond the noise of single pixels. What belongs to all pictures is fitted to other poses, what each picture has of its
// own to other blocks of the same picture.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

enum class RestKind {
  kLightOfPicture,  // each picture is brighter or darker as a whole
  kPlaceOfPicture,  // each picture lies elsewhere, evenly or growing from row to row
  kFewPictures,     // a few pictures hold most of it
  kInPicture,       // at the same places of every picture
  kOnObjects,       // at the same places of the objects
  kContours,        // contours sharper or softer than expected
  kStuckPixels,     // the same grey level at the same pixels of every picture, whatever they show
  kOneObject,       // the pictures of one object hold most of it
};

struct KindOfRest {
  RestKind kind = RestKind::kInPicture;
  double share = 0;   // of the excess error, 0 to 1
  std::string words;  // what is so
  std::string cause;  // what may cause it, what to look at; may be empty
};

// The largest share first; only kinds that take PhotoRowRules::min_kind_share or more. That it is one object's stands first
// where no other kind takes half of it. `photographs`: with the noise of what is left; `expected`: of the model, with details.
std::vector<KindOfRest> KindsOfRest(const Photographs& photographs, const std::vector<image::Photo>& expected,
                                    ThreadPool* pool);

// What is so; what may cause it only where the kind takes half of the excess error or more.
std::string InWords(const KindOfRest& kind);

// The share of one kind; 0 where it takes less than PhotoRowRules::min_kind_share.
double ShareOf(RestKind kind, const std::vector<KindOfRest>& kinds);

}  // namespace touchstone::diagnosis::images
