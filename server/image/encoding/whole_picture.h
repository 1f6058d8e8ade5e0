// Whether a picture file is all there. Decoders fill what is missing with grey: OpenCV takes a JPEG without its end
// (opencv issues 9477, 23311), and libtiff shows the strips that it finds.
#pragma once

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

namespace touchstone::image {

// A JPEG is followed from marker to marker (ITU-T T.81, annex B) from its start to its end, and its scans are
// decoded small, since one that was cut may have got an end all the same; a PNG from chunk to chunk to IEND, with nothing
// behind it (its decoders look at the checksums); of BMP, PGM, PPM and TIFF every byte of the pixels must be there.
// INVALID_ARGUMENT names the format and what is missing, or says that it is none of these.
absl::Status CheckWholePicture(absl::string_view bytes);

}  // namespace touchstone::image
