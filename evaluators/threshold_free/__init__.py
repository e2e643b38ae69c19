"""The threshold-free, pseudo one-to-one evaluation of Awrangjeb, Ravanbakhsh & Fraser (2010), section 4."""
