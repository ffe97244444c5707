//! Numbers in known files and small documents.
