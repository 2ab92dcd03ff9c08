"""What changes traced echoes or adds to them: artefact strengths, filters, rain, interference."""
