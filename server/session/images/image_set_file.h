// An image set (format: measurement_files.md) as a folder and as a message. What is read from either goes through the
// same checks; errors name file, line, column, what is wrong and what was expected, and nothing is dropped.
#pragma once

#include <map>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/session/images/image_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::session {

inline constexpr char kImagesCsv[] = "images.csv";
inline constexpr char kCameraYaml[] = "camera.yaml";
inline constexpr char kTouchesCsv[] =
    "touches.csv";  // measurement file of a joint set; no part of the ImageSet

// Limits of one set, whatever it comes from.
inline constexpr uint64_t kMaxImagesCsvBytes = 256 << 20;
inline constexpr uint64_t kMaxPictureBytes = 32 << 20;     // of one PNG file
inline constexpr uint64_t kMaxImageSetBytes = 1ull << 30;  // of all files, and of all pixels

// Whether a path leads to a folder with an images.csv. One that also holds a touches.csv is diagnosed jointly.
bool IsImageSetFolder(const std::string& path);
bool HasTouches(const std::string& folder);

absl::StatusOr<ImageSet> ReadImageSet(const std::string& folder);
absl::StatusOr<ImageSet> ParseImageSet(const v1::ImageSetFiles& files);

// What the pixels of such a set take in memory, by the headers of its pictures; pictures that cannot be read count nothing.
uint64_t PixelBytes(const v1::ImageSetFiles& files);

// The files of a folder as they are, for sending: images.csv, camera.yaml and the pictures that its rows name (other
// files are left alone). images.csv is checked on the way; pictures are not decoded. `origin` of the message is `folder`.
absl::StatusOr<v1::ImageSetFiles> ReadImageSetFiles(const std::string& folder);

// The files of a set; ParseImageSet gives the same set again.
absl::StatusOr<v1::ImageSetFiles> FormatImageSet(const ImageSet& set);

// Writes the files, and `others` by their names: the measurement file of a joint set, masks. A folder that is not there is made with all
// of them or not at all; into one that is there images.csv comes last, so that a folder with one is whole. ALREADY_EXISTS if
// an image set stands there.
absl::Status WriteImageSetFiles(const v1::ImageSetFiles& files, const std::string& folder,
                                const std::map<std::string, std::string>& others = {});
absl::Status WriteImageSet(const ImageSet& set, const std::string& folder);

// SHA-256 as `sha256sum images.csv camera.yaml PICTURE ... | sha256sum` prints it, pictures in the order of the rows.
std::string ImageSetHash(const ImageSet& rows, const v1::ImageSetFiles& files);

}  // namespace touchstone::session
