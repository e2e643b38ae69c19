"""A small COPC writer for tests: a root node and its four lower quarters, after COPC 1.0 (copc.io).

No package that roofbench uses writes COPC, and it must read it.
"""

import io
import struct

import laspy
import lazrs
import numpy as np
import pyproj
from laspy.vlrs.known import LasZipVlr

VLR_HEAD, INFO_SIZE = 54, 160


def write_copc(path, cloud, *, crs):
    """Write points (no colour): every fifth in the root, the others by quarter of the root cube."""
    low = np.array([cloud.x.min(), cloud.y.min(), cloud.z.min()])
    half = max(np.ptp(cloud.x), np.ptp(cloud.y), np.ptp(cloud.z)) / 2 + 0.5
    centre = low + half
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(low)
    header.add_crs(pyproj.CRS.from_user_input(crs))
    packing = lazrs.LazVlr.new_for_compression(6, 0, True)
    header.vlrs.insert(0, laspy.VLR("copc", 1, "", bytes(INFO_SIZE)))
    header.vlrs.append(LasZipVlr(bytes(packing.record_data())))
    header.are_points_compressed = True

    root = np.arange(len(cloud)) % 5 == 0
    nodes = [((0, 0, 0, 0), root)]
    for east in (0, 1):
        for north in (0, 1):
            here = ~root & ((cloud.x >= centre[0]) == bool(east)) & ((cloud.y >= centre[1]) == bool(north))
            nodes.append(((1, east, north, 0), here & (cloud.z < centre[2])))
    assert sum(mask.sum() for _, mask in nodes) == len(cloud), "the cloud must be flat"
    everything = record(header, cloud)
    header.partial_reset()
    header.grow(everything)

    body = io.BytesIO()
    header.write_to(body)
    packer = lazrs.LasZipCompressor(body, packing)
    packer.reserve_offset_to_chunk_table()
    entries = []
    for key, mask in nodes:
        start = body.tell()
        packer.compress_many(np.frombuffer(record(header, cloud.take(mask)).array.tobytes(), np.uint8))
        packer.finish_current_chunk()
        entries.append(struct.pack("<iiiiQii", *key, start, body.tell() - start, int(mask.sum())))
    packer.done()
    page = b"".join(entries)
    evlr = body.tell()
    body.write(struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(page), b"") + page)
    content = bytearray(body.getvalue())
    info = struct.pack("<3d2d2Q2d", *centre, half, 1.0, evlr + 60, len(page), 0.0, 0.0).ljust(INFO_SIZE, b"\0")
    content[375 + VLR_HEAD : 375 + VLR_HEAD + INFO_SIZE] = info
    struct.pack_into("<QI", content, 235, evlr, 1)  # LAS 1.4: where the extended records begin, and how many
    path.write_bytes(content)


def record(header, cloud):
    points = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
    points.x, points.y, points.z = cloud.x, cloud.y, cloud.z
    for name in ("return_number", "number_of_returns", "intensity", "classification"):
        if getattr(cloud, name) is not None:
            points[name] = getattr(cloud, name)
    return points
